"""Three-dimensional frictional contact of anisotropic magneto-electro-elastic solids."""

__version__ = "0.1.0"
