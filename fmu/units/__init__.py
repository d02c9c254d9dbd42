"""What ships inside the archives: the units' variables and behaviour, standard library only.

Whatever host imports a unit brings its own Python, of which nothing but the standard library may be assumed. The
builder copies this folder, together with what `archive.py` lists of `analytic`, into each archive under a name of
its own.
"""
