"""What all pages share: one frame, one style, light and dark, no request to anywhere."""
