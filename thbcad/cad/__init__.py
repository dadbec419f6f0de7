"""CAD exchange.  Only this subpackage imports OCP."""
