"""The gallery: every scenario with a picture, a clip, its file, and what agents do in it."""
