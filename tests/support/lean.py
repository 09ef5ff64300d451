"""`hijack` as where torch and JAX are not installed.

For tests of `hijack check` whose subject is not the kernels: most of a check is loading both and
compiling for JAX. `conformance/` and `test_ext_package.py` check with all of them.
"""

import sys

WHOLE = "from hijack_data.cli import main; main()"
CODE = f"import sys; sys.modules.update(torch=None, jax=None); {WHOLE}"
HIJACK = (sys.executable, "-c", CODE)
