"""What stands around the person: a scene, named or read from a TOML file."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from rtradar.errors import InputError

_KEYS = ("name", "description")


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Surroundings of the person; free space has none.

    Parameters
    ----------
    name : str
        Shown in reports.
    description : str
        One line for people.
    """

    name: str = "free-space"
    description: str = "nothing but the person"

    @classmethod
    def load(cls, source: str | Path) -> Scene:
        """A scene by its name under ``scenes/``, or a TOML file.

        Raises
        ------
        InputError
            Where there is no such scene, the file is not TOML, or it has a key that means nothing.
        """
        folder = scenes_folder()
        path = Path(source)
        if path.suffix != ".toml":
            path = folder / f"{source}.toml"
            if not path.is_file():
                known = ", ".join(sorted(file.stem for file in folder.glob("*.toml")))
                raise InputError(f"scene '{source}' is unknown; allowed: {known}, or the path of a TOML file")
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"scene file '{path}': {error.strerror}; give a TOML file or the name of a scene") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise InputError(f"scene file '{path}' is not TOML: {str(error).splitlines()[0]}") from None
        for key, value in table.items():
            if key not in _KEYS:
                raise InputError(f"scene file '{path}': unknown key '{key}'; allowed: {', '.join(_KEYS)}")
            if not isinstance(value, str):
                raise InputError(f"scene file '{path}': {key} = {value!r}; it must be a string")
        return cls(**{"name": path.stem, **table})


def scenes_folder() -> Path:
    """Folder of the scenes that come with rtradar: inside the installed package, or at the top of a checkout."""
    installed = Path(str(resources.files("rtradar"))) / "scenes"
    return installed if installed.is_dir() else Path(__file__).resolve().parents[2] / "scenes"
