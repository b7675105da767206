"""Mathematics without physics: quadrature rules whose bits are the same on every machine."""
