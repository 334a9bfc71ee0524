"""The camera itself in other languages: one file each that needs no library of this project.

`source.py` fills the templates beside it. The formula of the cubics and of their slopes is written
once, in operators that all of these languages share; coefficients are rows of P where numbers are
double, and columns of three where they are float.
"""
