"""Values that change where nobody looks are not used for what they were: judged by running."""

import itertools
from collections import Counter

from hijack_data.coords import CoordMap

from support.pointer import judge, programs

HALF = CoordMap((540, 960), (1080, 1920))

# What changes `a` (10), a list `p` ([10, 20]) or, with `p` replaced, one of the lists in `pts`.
CHANGES = programs(r"""
from random import shuffle; shuffle(p)

heapq.heapify(p)

from heapq import heapreplace as h; h(p, 50)

p.__setitem__(0, 50)

operator.setitem(p, 0, 50)

p.__iadd__([50])

p.__init__([50, 60])

p.reverse()

p = q = [10, 20]; q.reverse()

for z in pts: z.reverse()

[z.reverse() for z in pts]

[*pts][0].reverse()

y, z = pts; z.reverse()

list(pts)[1].reverse()

if not a: p = (10, 20)
else: p = [10, 20]
p.reverse()

p += [50]

p *= 2

del p[0]

p[0] += 40

p[:] = [50, 60]

for p[0] in (50,): pass

q = p; q[0] = 50

q = [p]; q[0].reverse()

(q := p).reverse()

(p, 1)[0].reverse()

{'p': p}['p'].reverse()

(lambda z: z.reverse())(p)

def f(z=p): z.reverse()
f()

def f(): p.reverse()
f()

max(p, p).reverse()

sum([], p).reverse()

(p or 1).reverse()

[z.reverse() for z in (p,)]

with contextlib.nullcontext(p) as z: z.reverse()

match p:
  case z: z.reverse()

class E:
  def __eq__(s, o): o.reverse()
E() == p

list = lambda z: z.reverse()
list(p)

(p if 1 else 1).reverse()

def f(*z): z[0].reverse()
f(p)

vars(__main__)['p'].reverse()

globals()['a'] = 50

globals().update(a=50)

vars()['a'] = 50

locals()['a'] = 50

exec('a = 50')

__main__.a = 50

setattr(__main__, 'a', 50)

import __main__ as m; m.a = 50

sys.modules['__main__'].a = 50

def f():
  global a
  a = 50
f()

(a := 50)

[a := z for z in (50,)]

import builtins; builtins.abs = lambda v: 50

abs = lambda v: 50

class K:
  global a
  a = 50

for a in (50,): pass

with contextlib.nullcontext(50) as a: pass

import sys as a

def a(): pass

try: 1 / 0
except ZeroDivisionError as a: pass

match 50:
  case a: pass

a, *b = 50, 60

f = (lambda: exec('a = 50', globals()))
f()

a: int = 50
""")
READS = programs(r"""
pyautogui.click(p[0], p[1])

pyautogui.click(p)

pyautogui.click(*p)

pyautogui.click(x=p)

x, y = p
pyautogui.click(x, y)

pyautogui.click(a, 20)

pyautogui.click(abs(a), 20)

pyautogui.click(a + 1, 20)

(lambda: pyautogui.click(a, 20))()

[pyautogui.click(a, 7) for _ in 'ab']

class C:
  pyautogui.click(a, 7)

pyautogui.click(*pts[0])

pyautogui.click(pts[1])
""")
SETUP = "a = 10\np = [10, 20]\npts = [[10, 20], [30, 40]]"


def test_no_change_of_a_value_goes_unseen():
    found = Counter()
    for change, read in itertools.product(CHANGES, READS):
        inner = change.replace("p.", "pts[0].").replace("(p", "(pts[1]")
        for lines in ([SETUP, change, read], [SETUP, inner, read], [SETUP, read, change, read]):
            code = "\n".join(lines)
            verdict, reached = judge(code, HALF)
            assert verdict in ("refused", "right"), f"{code}\n{verdict}"
            found[verdict] += reached
    assert min(found["refused"], found["right"]) > 300
