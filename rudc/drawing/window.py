"""A window that shows frames, for `render_mode="human"`. Needs pygame and a display."""

from __future__ import annotations

from rudc.drawing.frames import Frame
from rudc.errors import InputError
from rudc.hints import install_command


class Window:
    """Shows one frame after another, in real time."""

    def __init__(self, title: str, frames_per_second: float) -> None:
        """Raises InputError where there is no pygame, or no display."""
        try:
            import pygame
        except ImportError:
            raise InputError(
                f"a window needs pygame (the extra `window`): {install_command('window')}; "
                'without it: render_mode="rgb_array", or --video FILE.gif of `rudc run`'
            ) from None
        self._pygame = pygame
        self._title = title
        self._rate = frames_per_second
        self._screen: pygame.Surface | None = None
        self._clock = pygame.time.Clock()

    def show(self, frame: Frame) -> None:
        """Show a frame (height, width, 3), then wait until the next is due."""
        pygame = self._pygame
        height, width = frame.shape[:2]
        if self._screen is None:
            try:
                pygame.display.init()
                self._screen = pygame.display.set_mode((width, height))
            except pygame.error as error:
                raise InputError(
                    f"a window needs a display ({error}); "
                    'without one: render_mode="rgb_array", or --video FILE.gif of `rudc run`'
                ) from None
            pygame.display.set_caption(self._title)
        picture = pygame.image.frombuffer(frame.tobytes(), (width, height), "RGB")
        self._screen.blit(picture, (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(self._rate)

    def close(self) -> None:
        """Close the window."""
        if self._screen is not None:
            self._pygame.display.quit()
            self._screen = None
