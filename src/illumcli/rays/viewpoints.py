"""What rays are cast from, as a scene describes it: cameras and pixel filters by their fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, Protocol, Self, TypeAlias

Point: TypeAlias = tuple[float, float, float]


class _Viewpoint(Protocol):
    @property
    def position(self) -> Point: ...
    @property
    def target(self) -> Point: ...
    @property
    def up(self) -> Point: ...
    @property
    def fit(self) -> str | None:
        """Name of an object that is to fill the image."""

    def model_copy(self, *, update: Mapping[str, object] | None = None) -> Self:
        """The same camera with other fields."""
        ...


class PerspectiveCamera(_Viewpoint, Protocol):
    """A pinhole."""

    @property
    def projection(self) -> Literal["perspective"]: ...
    @property
    def fov(self) -> float:
        """Vertical field of view [degrees]."""
        ...


class OrthographicCamera(_Viewpoint, Protocol):
    """Parallel rays."""

    @property
    def projection(self) -> Literal["orthographic"]: ...
    @property
    def extent(self) -> float:
        """Height of the view [scene units]."""
        ...


Camera: TypeAlias = PerspectiveCamera | OrthographicCamera


class PixelFilter(Protocol):
    """Where in and around its pixel a sample lies."""

    @property
    def filter(self) -> Literal["box", "tent", "gaussian"]: ...
    @property
    def width(self) -> float:
        """Support of box and tent, and two standard deviations of the Gaussian, either side [half pixels]."""
        ...
