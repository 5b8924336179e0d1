"""What the sections state, computed: models, margins and responses as numbers; no prose, no pictures."""
