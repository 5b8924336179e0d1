"""The filter's measurement update: residuals, gates, gains, and measurements that arrive late."""
