"""Data sets of labelled clouds, read sample by sample."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.cards import cut, html_card, text_card
from rtradar.clouds.sample_files import (
    ARRAYS,
    KINDS,
    Sample,
    attributes,
    damaged,
    read_digest,
    read_index,
    read_sample,
    read_shape,
    sample_path,
)
from rtradar.errors import InputError
from rtradar.system.checks import brief, is_whole

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from rtradar.clouds.torch_dataset import SampleDataset


_ENTRIES = {
    "Subjects": "subject",
    "Sources": "source",
    "Radars": "radar",
    "Scenes": "scene",
    "Levels": "fidelity",
    "SNR [dB]": "snr_db",
}
"""Entry of the provenance for each row of what a data set shows of itself."""


class Collection:
    """Labelled clouds of one or several folders, ordered by folder and then by id.

    Labels and provenance are read at once, a cloud from its file when it is asked for.

    Parameters
    ----------
    *folders : path
        At least one folder made by ``rtradar dataset build``.

    Attributes
    ----------
    folders : tuple of path
        Folders of the samples.
    ids : tuple of str
        Id of each sample.
    paths : tuple of path
        File of each sample.

    Raises
    ------
    InputError
        If no folder is given, samples are missing or damaged, or a sample is in two folders; also
        where a cloud of a damaged file is read.
    """

    def __init__(self, *folders: str | Path) -> None:
        if not folders:
            raise InputError("no folder of clouds; give at least one of rtradar dataset build")
        self.folders = tuple(Path(folder) for folder in folders)
        self._name = ", ".join(f"'{folder}'" for folder in self.folders)
        # A folder that is named twice counts once; samples that two folders share are refused
        # below.
        paths: list[Path] = []
        for folder in dict.fromkeys(self.folders):
            own = [sample_path(folder, identity) for identity in read_index(folder)]
            if missing := sum(not path.is_file() for path in own):
                raise InputError(
                    f"collection '{folder}': {missing} of {len(own)} samples are missing; "
                    "finish it with: rtradar dataset build"
                )
            paths += own
        self.paths = tuple(paths)
        self.ids = tuple(path.stem for path in paths)
        if repeated := len(self.ids) - len(set(self.ids)):
            raise InputError(
                f"{repeated} samples are in more than one of {self._name}; leave one out"
            )
        self._about = [read_sample(path, "about") for path in self.paths]

    def __repr__(self) -> str:
        lines = {label.lower(): value for label, value in self._rows.items()}
        return text_card("Collection", self._name, lines)

    def _repr_html_(self) -> str:
        return html_card("Collection", self._name, {"": self._rows})

    @property
    def _rows(self) -> dict[str, str]:
        found = {"Samples": f"{len(self):,}", "Activities": _counted(self.labels.tolist())}
        for label, key in _ENTRIES.items():
            values = [entries[key] for entries in self.provenance if key in entries]
            if values:
                found[label] = _counted(values)
        return found

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, index: int) -> Sample:
        about = self._about[index]
        return Sample(self.points(index), about["label"], about["provenance"])

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the activities, ascending."""
        return tuple(sorted({about["label"] for about in self._about}))

    @property
    def labels(self) -> NDArray[np.str_]:
        """Activity of each sample, (sample,)."""
        return np.array([about["label"] for about in self._about], dtype=np.str_)

    @property
    def provenance(self) -> list[Mapping[str, Any]]:
        """Provenance of each sample; the clouds are not read."""
        return [about["provenance"] for about in self._about]

    def column(self, name: str) -> NDArray[Any]:
        """Return one entry of the provenance of each sample, without reading the clouds.

        Parameters
        ----------
        name : str
            Name of the entry, such as ``subject`` or ``snr_db``.

        Returns
        -------
        (sample,) ndarray
            Values of the entry, None for a sample that lacks it.

        Raises
        ------
        InputError
            If no sample has such an entry.
        """
        if not any(name in entries for entries in self.provenance):
            known = sorted({key for entries in self.provenance for key in entries})
            raise InputError(
                f"collection {self._name}: no sample has '{name}'; there are: {', '.join(known)}"
            )
        values = [entries.get(name) for entries in self.provenance]
        if all(isinstance(value, int | float | str) for value in values):
            return np.array(values)
        # Assigned to an object array, because lists of equal length would become a second axis.
        column = np.empty(len(values), dtype=object)
        column[:] = values
        return column

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of arrays that every sample holds: clouds, and what the data set keeps."""
        kept = [set(self._kept(index)) for index in range(len(self))]
        shared = set.intersection(*kept) if kept else set()
        return ("clouds", "spatial", *(kind for kind in KINDS if kind in shared))

    def _kept(self, index: int) -> list[str]:
        """Return the kinds of arrays that a sample holds beside its clouds."""
        kept = self._about[index]["provenance"].get("keep")
        return [kind for kind in KINDS if kind in kept] if isinstance(kept, list) else []

    def maps(self, index: int) -> xr.Dataset:
        """Read the maps and joints that the data set keeps of a sample.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.

        Returns
        -------
        Dataset
            Those of ``spectrogram``, ``range_doppler``, ``range_azimuth`` and ``joints`` that are
            kept, with their axes; units are attributes.

        Raises
        ------
        InputError
            If its file is damaged.
        """
        import xarray as xr

        # The maps that are kept, and the axes that these have.
        kept = [KINDS[kind] for kind in self._kept(index)]
        axes = {axis for name in kept for axis in ARRAYS[name].dims if axis in ARRAYS}
        found = {
            name: (ARRAYS[name].dims, read_sample(self.paths[index], name), attributes(name))
            for name in (*kept, *sorted(axes))
        }
        joints = self._about[index]["provenance"].get("joint_names", [])
        names = {"joint": joints, "axis": list("xyz")}
        try:
            return xr.Dataset(found, names if "joints" in kept else {}).set_coords(axes)
        except (ValueError, TypeError):  # arrays of a stranger's file that do not fit each other
            raise damaged(self.paths[index]) from None

    def to_pandas(self) -> pd.DataFrame:
        """Return what is known of every sample, without reading the clouds.

        Returns
        -------
        DataFrame
            One row for each sample, under its id: ``activity``, its class number ``label``, all
            entries of the provenance, such as subject, recording, licence, radar, scene, fidelity,
            heading_deg, snr_db and seed, the ``folder`` of the sample and the ``digest`` of its
            file (SHA-256). What a sample lacks is NaN or None.

        Raises
        ------
        InputError
            If the file of a sample is not there any more.
        """
        import pandas as pd

        number = {name: index for index, name in enumerate(self.classes)}
        rows = []
        for about, path in zip(self._about, self.paths, strict=True):
            own = {"activity": about["label"], "label": number[about["label"]]}
            # What is first stays first, and what is last is said.
            row = own | about["provenance"] | own
            rows.append(row | {"folder": str(path.parent), "digest": read_digest(path)})
        return pd.DataFrame(rows, index=pd.Index(self.ids, name="id"))

    def torch(
        self, kind: str = "clouds", *, points: int = 1000, source: bool = False
    ) -> SampleDataset:
        """Return the samples as a `torch.utils.data.Dataset`, for a `DataLoader`.

        All items have one size, so that they can be batched as they are. They follow from the
        samples alone: the same item is the same in every epoch, worker and session.

        Parameters
        ----------
        kind : str
            Array of each sample: ``clouds`` gives (point, 3) time [s], range [m] and velocity
            [m/s], ``spatial`` (point, 3) world coordinates [m]. If the data set keeps them,
            ``spectrograms`` gives (time, velocity), ``range_doppler`` (time, range, velocity) and
            ``range_azimuth`` (time, range, azimuth) power [m^2], and ``joints`` (time, joint, 3)
            world coordinates [m].
        points : int
            Number of points of each cloud. Of larger clouds as many are taken, a random sample of
            an RDT cloud; points of smaller ones are repeated, and an empty one becomes zeros.
        source : bool
            Whether each item of ``spatial`` has a third entry: who returned each point, int64
            (point,), as `spatial_source` gives it; -2 in an empty cloud.

        Returns
        -------
        torch.utils.data.Dataset
            Pairs of a float32 tensor and the class number, an index into its ``classes``.

        Raises
        ------
        InputError
            If torch is missing, the kind is unknown or not kept, its arrays have several sizes, or
            the number of points is not positive.
        """
        # Whatever would fail in a worker of a loader later is refused here.
        if kind not in list(KINDS):  # whatever it is
            raise InputError(f"kind = {brief(kind)} is unknown; allowed: {', '.join(KINDS)}")
        if not is_whole(points) or points < 1:
            raise InputError(f"points = {brief(points)}; it must be a whole number from 1 on")
        try:
            from rtradar.clouds.torch_dataset import SampleDataset
        except ImportError:
            raise InputError(
                "Collection.torch needs torch; install the extra 'learn' of rtradar, "
                "in a checkout: pip install -e '.[learn]'"
            ) from None
        if kind not in self.kinds:
            raise InputError(
                f"not every sample of collection {self._name} holds {kind}, only "
                f'{", ".join(self.kinds)}; build it anew with keep = ["{kind}"]'
            )
        if source and not (kind == "spatial" and all(map(self._has_sources, range(len(self))))):
            raise InputError(
                "source = True: only kind = 'spatial' of samples with several people or objects "
                "says who returned its points; leave it out"
            )
        # Clouds are cut or filled to a number of points; maps must have one size by themselves.
        clouds = kind in ("clouds", "spatial")
        shapes = {read_shape(path, KINDS[kind]) for path in self.paths if not clouds}
        if len(shapes) > 1:
            raise InputError(
                f"{kind} of collection {self._name} have {len(shapes)} sizes, such as "
                f"{' and '.join(map(str, sorted(shapes)[:2]))}, which cannot be batched; "
                "build data sets of one duration_s and one radar"
            )
        return SampleDataset(
            self.paths, self.labels.tolist(), KINDS[kind], points if clouds else None, source
        )

    def points(self, index: int) -> NDArray[np.float64]:
        """Read the RDT cloud of a sample.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.

        Returns
        -------
        (n, 3) float64
            Time [s], range [m] and velocity [m/s] of each point.
        """
        return read_sample(self.paths[index], "points")

    def spatial(self, index: int) -> NDArray[np.float64]:
        """Read the spatial cloud of the same capture.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.

        Returns
        -------
        (m, 3) float64
            World coordinates x, y and z [m] in the order of time; m may be 0. A coordinate that the
            radar does not measure is NaN in every point (`SpatialCloud`).

        Raises
        ------
        InputError
            If its file is damaged.
        """
        return read_sample(self.paths[index], "spatial")

    def whole_cloud(self, index: int) -> NDArray[np.float64]:
        """Read the spatial cloud of a data set with ``whole_clouds``, as a radar's board lists it.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.

        Returns
        -------
        (m, 5) float64
            Time of the frame [s], world coordinates x, y and z [m] and velocity [m/s].

        Raises
        ------
        InputError
            If its file is damaged, or holds no times and velocities.
        """
        if not self.provenance[index].get("whole_clouds"):
            raise InputError(
                f"collection {self._name} has no whole clouds; build it with whole_clouds = true"
            )
        names = ("spatial_time", "spatial", "spatial_velocity")
        return np.column_stack([read_sample(self.paths[index], name) for name in names])

    def spatial_source(self, index: int) -> NDArray[np.int64] | None:
        """Read who returned each point of the spatial cloud.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.

        Returns
        -------
        (m,) int64, optional
            For each point the index of who returned most of it: 0 the person of the label, then
            others and objects as ``source_names`` of the provenance lists them, -1 the room or
            nobody. None where one person is alone.

        Raises
        ------
        InputError
            If its file is damaged.
        """
        if not self._has_sources(index):
            return None
        return read_sample(self.paths[index], "spatial_source").astype(np.int64)

    def _has_sources(self, index: int) -> bool:
        return "source_names" in self._about[index]["provenance"]


def _counted(values: Iterable[object]) -> str:
    """List different values, the most frequent first, each with its number of samples."""
    counts = Counter(cut(str(value), 40) for value in values).most_common()
    if len(counts) > 12:
        return f"{len(counts)} different ones"
    return ", ".join(f"{value} ({count:,})" for value, count in counts)
