"""Pictures of roads and episodes: frames, films, previews, networks. All with Pillow.

matplotlib is for plots of results (`rudc/reporting`).
"""
