from __future__ import annotations

from illumcli.geometry.repairs import Repair, joined, located, note


def test_counts_add_up_and_the_first_place_stays() -> None:
    found: dict[str, Repair] = {}
    note(found, "faces", ":3")
    note(found, "faces", ":1", 4)
    assert found == {"faces": Repair(5, ":3")}
    assert joined([found, {"uv": Repair(1)}, found]) == {"faces": Repair(10, ":3"), "uv": Repair(1)}


def test_places_are_those_of_the_file_or_of_one_beside_it() -> None:
    places = {
        ":3": "in/a.obj:3",
        ": face 2": "in/a.obj: face 2",
        "": "in/a.obj",
        "m/a.mtl:2": "in/m/a.mtl:2",
    }
    for inside, whole in places.items():
        assert located({"what": Repair(1, inside)}, "in/a.obj") == {"what": Repair(1, whole)}
