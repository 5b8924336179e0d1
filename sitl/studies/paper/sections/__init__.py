"""The sections of the page, in the order of the paper: each flies or computes, checks, and draws."""
