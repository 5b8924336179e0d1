"""The paper, reproduced and corrected: `sitl paper` writes one page and the numbers behind it."""
