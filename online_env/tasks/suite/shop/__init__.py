"""Shopping on shop.test."""
