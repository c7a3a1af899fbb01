"""A plant with additional effects, as MJCF where MuJoCo has them, else as ``effects.json``."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jaxidl.effects import Effect, added_to
from jaxidl.errors import EffectError
from jaxidl.files import write_bytes
from jaxidl.systems.attributes import Numbers, drives, kind, motors
from jaxidl.systems.flange import flange_of
from jaxidl.systems.loading import load_part, quietly
from jaxidl.systems.mjcf import Model, as_read
from jaxidl.systems.record import EFFECTS, Entry, check_fits, read_record
from jaxidl.systems.rewriting import prepared, rewritten

MODEL = "model.xml"


def write_patched(model: Model, added: Sequence[Effect], folder: Path) -> tuple[Path, Path]:
    """Write :func:`patched` as ``model.xml`` and ``effects.json`` into ``folder``.

    The folder is created. Both paths are returned.

    Raises:
        ModelError, EffectError: as :func:`patched`; nothing is written then.
        StoreError: if a file cannot be written.
    """
    text, record = patched(model, added)
    paths = folder / MODEL, folder / EFFECTS
    write_bytes(paths[0], text.encode())
    write_bytes(paths[1], (json.dumps(record, indent=1, allow_nan=False) + "\n").encode())
    return paths


def patched(model: Model, added: Sequence[Effect]) -> tuple[str, dict[str, Any]]:
    """Return MJCF text and ``effects.json`` record of ``model`` with the effects ``added``.

    The model is that of its files when they were read. Reading text and record again gives the same
    plant; effects with ``in_mjcf`` true are those that the text alone restores. Scale, saturation
    and lag of a drive are in the record, and written as motors too if the user's model has no
    actuators. Meshes and textures are named by absolute paths.

    Raises:
        EffectError: if an effect of ``added`` is out of its bounds or does not fit the joints.
        ModelError: if the model's files are gone or have other joints than when they were read.
    """
    joints = len(model.names)
    for n, effect in enumerate(added):
        added_to((*model.plant.effects, *added[:n]), effect).check()
        check_fits(effect, joints, bounded=False)
    with quietly(), as_read(model) as path:
        entries = read_record(path, joints)
        spec, _ = load_part(path, model.part, model.locked, model.flange, follow=True)
        body: Any = model.plant.body
        compiled, following = prepared(spec, model), body.following
        numbers = Numbers(compiled, following and following.own, flange_of(body.source))
        numbers.expect(added)
        for effect in added:
            place = effect.write_mjcf(numbers)
            entries = _with(entries, Entry(effect, place is not None, place))
        made = [] if compiled.nu else motors([entry.effect for entry in entries], joints)
        text = rewritten(spec, compiled, numbers, made, model.path)
    return text, {
        "model": MODEL,
        "effects": [
            _with_drive(entry, joints, bool(made)).to_dict(model.kinds) for entry in entries
        ],
    }


def _with(entries: list[Entry], new: Entry) -> list[Entry]:
    """Return the entries with a new one.

    A change that cannot stand alone, such as friction that is less, is added to what it changes.
    """
    try:
        new.effect.check()
        return [*entries, new]
    except EffectError:
        if new.in_mjcf:
            return [*entries, new]
    place = getattr(new.effect, "joint", None)
    same = [
        e
        for e in entries
        if not e.in_mjcf
        and kind(e.effect) is kind(new.effect)
        and getattr(e.effect, "joint", None) == place
    ]
    whole = added_to([e.effect for e in same], new.effect)
    return [*(e for e in entries if e not in same), new._replace(effect=whole)]


def _with_drive(entry: Entry, joints: int, written: bool) -> Entry:
    """Return the entry of a drive's effect with the attributes that its motors have.

    Other entries are returned unchanged.
    """
    if not drives(entry.effect, joints):
        return entry
    return entry._replace(mjcf=", ".join(kind(entry.effect).mjcf.values()) if written else None)
