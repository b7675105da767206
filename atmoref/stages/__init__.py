"""One file per GPU stage, named like the shader it mirrors: arrays and uniforms in, buffers out."""
