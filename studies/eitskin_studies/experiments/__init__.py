"""``eitskin study NAME``: the paper's experiments, and past them; one module or package an
experiment, named in ``registry``."""
