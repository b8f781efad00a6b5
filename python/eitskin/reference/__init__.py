"""The numpy reference: the C core step by step in double precision, to check it against."""
