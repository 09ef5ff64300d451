"""An MCP server through which any MCP client plays one corrupted, scored episode."""
