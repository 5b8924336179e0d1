"""One flight: scenario, launch, progress, figures, report."""
