"""Writing and reading tables: numpy arrays <-> C11 files that controller/tab evaluates."""

from engram.emit.kinds import Gpr, Knn, Logit, Pca, Rbf, Table, Tt
from engram.emit.models import Gmr, Mlp, Sdf
from engram.emit.read import TableFile, read_folder
from engram.emit.write import write_tables

__all__ = ["Gmr", "Gpr", "Knn", "Logit", "Mlp", "Pca", "Rbf", "Sdf", "Table", "TableFile", "Tt", "read_folder", "write_tables"]
