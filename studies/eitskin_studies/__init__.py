"""How the product is judged: experiments, benchmarks, comparisons, trade-offs and their
pictures."""
