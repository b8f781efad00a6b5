"""The oracle: a reconstruction by its definition, in dense float64 numpy.

The C core is compared with it. It is written from the formulas of docs/reference and of
docs/design/oracle.md, not from the C code: without caches, without limits of work, without updates
of a result that was there before. It changes when a definition changes, and not with the C code.
"""
