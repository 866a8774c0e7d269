"""Systems whose sensors lie and whose streams are in disorder, at random, and what must hold all the same."""
