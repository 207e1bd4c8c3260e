"""The one style of all pictures: size, fonts, grid and colours, in a light and a dark variant.

Nothing here changes Matplotlib's global settings, because pictures of a run may be drawn in several
threads, and the user's own figures keep their style. A picture is drawn on axes in the colours of
`theme_of`, and `dress` then sets fonts, grid and frame of these axes alone.

Pictures are `WIDTH_IN` wide, but for the still of a view and tables of many columns. Shown 420
pixels wide, a letter of the smallest font is 8 pixels high.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from rtradar.errors import InputError
from rtradar.system.checks import brief

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 6.0
"""Width of pictures [inch]."""

STYLE: Mapping[str, Any] = {
    "figure.dpi": 150,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "xtick.labelsize": 9.0,
    "legend.fontsize": 8.5,
    "font.size": 8.5,
    "grid.linewidth": 0.6,
    "grid.alpha": 0.5,
}
"""Sizes and fonts [pt], by the names of Matplotlib's settings; ``font.size`` is that of notes."""

_PNG_LEVEL = 3  # quicker than the usual 6, for files that are a little larger

DIVERGING = "coolwarm"
"""Colour map of velocities: blue approaches, red recedes."""


@dataclass(frozen=True)
class Theme:
    """Colours of a picture."""

    page: str
    text: str
    faint: str
    wall: str
    furniture: str
    reflector: str
    radar: str
    person: str
    ghost: str
    detection: str
    cycle: tuple[str, ...]


_THEMES = tomllib.loads(Path(__file__).with_name("themes.toml").read_text(encoding="utf-8"))

LIGHT, DARK = (
    Theme(**_THEMES[name] | {"cycle": tuple(_THEMES[name]["cycle"])}) for name in ("light", "dark")
)
"""Colours on a white page, and on a dark one."""


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """Make an empty figure without a window, which pyplot does not know.

    Parameters
    ----------
    height_in : float
        Height of the figure [inch].
    width_in : float
        Width of the figure [inch].

    Returns
    -------
    Figure
        Figure that lays out its axes by itself.
    """
    from matplotlib.figure import Figure

    size, dpi = (width_in, height_in), STYLE["figure.dpi"]
    return Figure(figsize=size, dpi=dpi, facecolor=LIGHT.page, layout="constrained")


def save_figure(figure: Any, file: Path | BinaryIO, *, pdf: Path | None = None) -> None:
    """Save a figure as PNG, and clear it.

    Figure and axes refer to each other. Without clearing, the memory of one picture could
    still be in use with the next, until Python's garbage collector runs.

    Parameters
    ----------
    figure : Figure
        Figure of `new_figure`, in which no text is read as a formula.
    file : Path or binary file
        Path, or file open for writing.
    pdf : Path, optional
        Path of the same picture as PDF, whose lines and letters stay sharp in a paper.
    """
    from matplotlib.text import Text

    for text in figure.findobj(Text):  # names of files, radars and walls may have dollar signs
        text.set_parse_math(False)
    write_png(figure, file)
    if pdf is not None:
        write_pdf(figure, pdf)
    figure.clear()


def write_pdf(figure: Any, file: Path) -> None:
    """Write a figure as PDF, the same bytes whenever that is."""
    figure.savefig(file, metadata={"CreationDate": None})


def write_png(figure: Any, file: Path | BinaryIO) -> None:
    """Lay out a figure and draw it, once: `Figure.savefig` draws before that in order to lay out.

    Parameters
    ----------
    figure : Figure
        Figure of `new_figure`.
    file : Path or binary file
        Path, or file open for writing.
    """
    from matplotlib.backend_bases import FigureCanvasBase
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)
    canvas.print_png(file, pil_kwargs={"compress_level": _PNG_LEVEL})
    FigureCanvasBase(figure)  # in place of the canvas that holds what was drawn


def png_of(figure: Any) -> bytes:
    """Return the PNG file of a figure of `new_figure`, and clear the figure.

    Parameters
    ----------
    figure : Figure
        Figure that is drawn.

    Returns
    -------
    bytes
        Content of the file.
    """
    from io import BytesIO

    file = BytesIO()
    save_figure(figure, file)
    return file.getvalue()


def figure_for(height_in: float) -> Figure:
    """Make a figure of pyplot, which a notebook shows and ``pyplot.show()`` opens.

    Parameters
    ----------
    height_in : float
        Height of the figure [inch].

    Returns
    -------
    Figure
        Figure in the colours that the user has set for pyplot.
    """
    import matplotlib.pyplot as plt

    return plt.figure(figsize=(WIDTH_IN, height_in), layout="constrained")


def axes_given(first: Any, ax: Any) -> tuple[Any, Axes | None]:
    """Return the first argument of a plot and its axes, which may be the first argument alone.

    InputError if they are no axes of Matplotlib.
    """
    from matplotlib.axes import Axes  # slow to import

    if isinstance(first, Axes) and ax is None:
        return None, first
    if not isinstance(ax, Axes | None):
        raise InputError(
            f"plot: ax = {brief(ax)}; it must be axes of Matplotlib, such as plt.gca() gives"
        )
    return first, ax


def write_heading(figure: Any, title: str) -> None:
    """Write the title of a figure of several axes, in lines that fit.

    Parameters
    ----------
    figure : Figure
        Figure that has its axes.
    title : str
        Title, of which no part is read as a formula.
    """
    size, colour = STYLE["axes.titlesize"], theme_of(figure.axes[0]).text
    lines = fit(title, 0.95 * 72 * figure.get_size_inches()[0], size)
    figure.suptitle(lines, fontsize=size, color=colour, parse_math=False)


def theme_of(axes: Axes) -> Theme:
    """Return the colours that suit a figure: dark if its background is.

    Parameters
    ----------
    axes : Axes
        Axes of the figure.

    Returns
    -------
    Theme
        `LIGHT` or `DARK`.
    """
    from matplotlib.colors import to_rgba

    figure: Any = axes.get_figure(root=True)
    red, green, blue, opacity = to_rgba(figure.get_facecolor())
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    return DARK if opacity > 0 and luminance < 0.4 else LIGHT


def dress(
    axes: Axes, *, title: str = "", note: str = "", grid: bool = True, across: float = 1
) -> None:
    """Give axes that are drawn on their title, note, fonts, grid and colours.

    Call it before a colour bar takes its room from the axes, and once more for the axes of the bar.

    Parameters
    ----------
    axes : Axes
        Axes that have their labels, ticks and legend.
    title : str
        Title, which is broken into lines that fit; no part of it is read as a formula.
    note : str
        Sentence in small letters below the axes, broken into lines that fit.
    grid : bool
        Whether to draw grid lines.
    across : float
        Width of title and note, as a multiple of the width of the axes: their number where the axes
        are the first of several side by side.
    """
    # Texts are broken to the width that the axes have on the page.
    theme = theme_of(axes)
    is_3d = axes.name == "3d"
    figure: Any = axes.get_figure(root=True)
    width_pt = 72 * across * axes.get_position(original=True).width * figure.get_size_inches()[0]
    if title:
        size, place = STYLE["axes.titlesize"], STYLE["axes.titlelocation"]
        style: dict[str, Any] = {"fontsize": size, "color": theme.text, "loc": place}
        axes.set_title(fit(title, width_pt, size), parse_math=False, **style)
    for name in "xyz" if is_3d else "xy":
        axis = getattr(axes, f"{name}axis")
        axis.label.set(fontsize=STYLE["axes.labelsize"], color=theme.text)
        size = STYLE["xtick.labelsize"]
        axis.set_tick_params(labelsize=size, color=theme.text, labelcolor=theme.text)
        axis.get_offset_text().set_color(theme.text)
    # Frame, background and grid in the colours of the theme. A map covers its background and has no
    # grid.
    for spine in axes.spines.values():
        spine.set_edgecolor(theme.faint)
    if is_3d or not axes.images:
        axes.set_facecolor(theme.page)
    if is_3d:
        for name in "xyz":
            axis = getattr(axes, f"{name}axis")
            axis.set_pane_color(theme.page)
            axis.line.set_color(theme.faint)
    elif grid:
        style = {"linewidth": STYLE["grid.linewidth"], "alpha": STYLE["grid.alpha"]}
        axes.grid(True, color=theme.faint, **style)
        axes.set_axisbelow(True)
    # A legend that lies over the picture lets it shine through.
    if (legend := axes.get_legend()) is not None:
        legend.get_frame().set(facecolor=theme.page, edgecolor=theme.faint, alpha=0.85)
        for text in legend.get_texts():
            text.set(color=theme.text, fontsize=STYLE["legend.fontsize"], parse_math=False)
    if note:
        size = STYLE["font.size"]
        # The note begins below ticks and label.
        lines = 1 + axes.get_xlabel().count("\n")
        below = 22 + 1.3 * STYLE["axes.labelsize"] * lines
        style = {"fontsize": size, "parse_math": False, "va": "top", "annotation_clip": False}
        style |= {"xycoords": "axes fraction", "textcoords": "offset points"}
        style |= {"color": theme.text, "xy": (0, 0), "xytext": (0, -below)}
        lines_of_note = fit(note, width_pt, size)
        axes.annotate(lines_of_note, alpha=0.85, in_layout=False, **style)
        # A note is wider than its axes. Only its height may move the others, as with a title.
        axes.annotate("\n".join("." for _ in lines_of_note.splitlines()), alpha=0, **style)


def fit(text: str, width_pt: float, size_pt: float) -> str:
    """Break a text into lines that are not wider than a width.

    Lines break between words; a word that is longer than a line breaks after a hyphen, an
    underscore, a slash or a dot, or anywhere if it has none.

    Parameters
    ----------
    text : str
        Text, whose own line breaks stay.
    width_pt : float
        Largest width of a line [pt].
    size_pt : float
        Size of the font [pt].

    Returns
    -------
    str
        Lines of the text.
    """
    import re

    lines = []
    for paragraph in text.split("\n"):
        line = ""
        # Words fill a line until one does not fit, which begins the next.
        for word in paragraph.split():
            joined = f"{line} {word}" if line else word
            if _width_pt(joined, size_pt) <= width_pt:
                line = joined
                continue
            if line:
                lines.append(line)
            line = ""
            # A word that is too long by itself goes on in pieces.
            for piece in re.findall(r"[^-_/.]*[-_/.]|[^-_/.]+", word):
                for part in (piece,) if _width_pt(piece, size_pt) <= width_pt else piece:
                    if line and _width_pt(line + part, size_pt) > width_pt:
                        lines.append(line)
                        line = ""
                    line += part
        lines.append(line)
    return "\n".join(lines)


def _width_pt(text: str, size_pt: float) -> float:
    from matplotlib.font_manager import FontProperties, findfont, get_font

    # Widths are measured in the font itself, in 64ths of a point.
    font = get_font(findfont(FontProperties()))  # one for each thread
    font.set_size(size_pt, 72)
    font.set_text(text.strip())
    return float(font.get_width_height()[0]) / 64
