"""What ``import cubicfish_cli`` offers beyond the parts themselves: arrays in, arrays out."""
