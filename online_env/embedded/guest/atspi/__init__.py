"""Reading the accessibility tree over AT-SPI's D-Bus protocol."""
