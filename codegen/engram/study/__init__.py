"""Studies: the tables and pictures of the thesis, made again by the code that flies, beside the thesis' own figures."""
