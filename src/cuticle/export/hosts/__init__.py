"""The hosts, a module each: `cuticle.export.registry` says what one has to offer."""
