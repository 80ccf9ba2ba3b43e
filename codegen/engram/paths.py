"""Where things are in the repository."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "models"  # authored: robot.toml, task.toml, world.xml
TABLES = ROOT / "tables"  # generated and committed
BUILD = ROOT / "build"  # generated, never committed: meshes, scenes, figures


def relative(path: Path) -> str:
    """`path` as seen from the repository root if it lies inside, for messages and provenance lines."""
    path = Path(path).resolve()
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)


def write_changed(path: Path, text: str) -> None:
    """Write `text` unless the file holds it already: what is unchanged is not compiled again."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
