"""Writes models.md, the page of all models, from their own docstrings and schemas.

Run it after a change to a model; a test compares the page with what this makes of the code.
"""

from __future__ import annotations

from pathlib import Path

import illumcli as illum
from illumcli.commands.models import CLAIMS, page
from illumcli.schema.sources import tags

PAGE = Path(__file__).with_name("models.md")
PACKAGE = "illumcli.models"
HEAD = """\
# Illumination models

<!-- made by docs/make_models.py -->

A model says how much light leaves towards the eye per unit of irradiance that faces the light, its cosine
included: its *response*. Physical models are a BRDF times the cosine; the others are intensities as the texts
print them, without 1/pi. Directions leave the surface: `l` to the light, `v` to the eye, `n` the normal, `h`
half way between `l` and `v`, `r` the light mirrored at `n`; `n_l` reads "n dot l". Anisotropic models need a
grain: an object's own (`grain:`), or the direction in which u grows.

Any colour or number marked so may vary over the surface: `{texture: bark.png}` looks it up by uv, and
`{vertex: color}` interpolates an attribute of the mesh. A texture of a number is data, not a picture:
`{texture: rough.png, space: linear, channel: g}`. (0, 0) in uv is the lower left corner of the image. Either
may have a `factor`; a texture may be multiplied by an attribute too, `{texture: bark.png, vertex: color}`,
and looked up by another attribute than the mesh's uv, `uv: uv1`. The samples of a pixel average what it
covers (`film.samples`); there are no smaller copies of the image. Values beyond a parameter's range are
clipped to it, and the report counts them. In films a parameter may vary over time and surface at once
([animation](animation.md#over-time-and-surface)).

```sh
illum models
illum models ward
illum brdf ward ashikhmin_shirley --view sphere --view lobe -o out/streaks.png
illum verify --only ward
```

`illum verify` compares every model with values at 50 digits, computed from its paper by other algebra (angles
for dot products, integrals for closed forms): 895 cases of parameters as a scene has them, relative error
2e-13 at most, and 90 of `generated`, whose tables are made by quadrature, within 1.5e-5. The values of `merl`
and `rgl` stand in files; the tests compare the lookup with values known beforehand.

![Sixty teapots: a column per family of models, a row per parameter](gallery.png)

The columns, from the left: Lambert, Oren-Nayar, Minnaert, Lommel-Seeliger; Phong, Blinn-Phong; Strauss;
Cook-Torrance with laws of Fresnel and as plastic; its distributions of facets; Ward; Ashikhmin-Shirley;
Kajiya-Kay, Poulin-Fournier, Lafortune; principled; Fujii, EON, Burley, metallic-roughness; `generated`;
`formula`. The values stand in
[scenes/gallery.yaml](../scenes/gallery.yaml). One command renders it, on the teapot or on any mesh; other
scenes show one thing each:

```sh
illum render scenes/gallery.yaml -o out/gallery.png
illum render scenes/gallery.yaml -D 'meshes.pot={file: ../bunny.obj}' -o out/gallery-bunny.png
illum render scenes/moon.yaml -o 'out/moon-{camera}.png'
illum render scenes/copper.yaml scenes/grain.yaml scenes/textures.yaml -o 'out/{scene}.png'
illum render scenes/masking.yaml -o out/masking.png
```

- `moon`: lit from behind the eye, Lambert's ball darkens to its rim; Oren-Nayar's is flatter, the rougher it
  is; Minnaert's at k = 0.5 and Lommel-Seeliger's are discs of one brightness, as the full Moon is.
- `copper`: at grazing a highlight takes the colour of its light. With the index of about 10 that copper's F0
  implies, Cook and Torrance's interpolation turns only in the last two degrees; the scene says 1.5.
- `masking`: rough aluminium under V-grooves, Smith's masking, and Smith's correlated by height; in the last
  column it is anisotropic. V-grooves leave a crease where they begin to block light; Smith's is smooth.
- `grain`: highlights lie across the grain, so a turned disc and a record have two, on opposite sides.
"""


def text() -> str:
    """The whole page."""
    names = tags(PACKAGE)
    rows = ["| model | what it is | claims |", "| --- | --- | --- |", *map(_row, names)]
    claims = [f"- *{claim}*: {meaning}." for claim, meaning in CLAIMS.items()]
    parts = [f"## {name}\n\n```text\n{page(name)}\n```" for name in names]
    return "\n\n".join([HEAD.rstrip(), "\n".join(rows), "\n".join(claims), *parts]) + "\n"


def _row(name: str) -> str:
    model = illum.models(name)
    kept = ", ".join(claim for claim, holds in model.claims.items() if holds)
    return f"| [{name}](#{name}) | {model.text.rstrip('.')} | {kept} |"


if __name__ == "__main__":
    PAGE.write_text(text())
