"""Drawing: measured text, sprites and the recipes that make them."""
