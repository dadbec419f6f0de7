"""What a problem describes: sources, materials, receivers, light paths, and the system of them."""
