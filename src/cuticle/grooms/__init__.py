"""Hair as geometry: read, made and measured without a renderer."""
