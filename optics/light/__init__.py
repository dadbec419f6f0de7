"""What light does: refraction, tracing, pixels, blur, and its measurement."""
