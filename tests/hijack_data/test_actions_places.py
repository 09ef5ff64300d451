"""A pointer call is followed wherever it stands, or refused: judged by running the programs."""

import itertools
from collections import Counter

from hijack_data.coords import CoordMap

from support.pointer import judge, programs

HALF = CoordMap((540, 960), (1080, 1920))

# Where a {c}all can stand. Some do not run at once, or see other names than they seem to.
PLACES = programs(r"""
{c}

x: {c} = 5

x: {c}

def f() -> {c}: pass

def f(x: {c}): pass

def f(*x: {c}, **y: {c}): pass

def f(x={c}): pass
f(1)

def f(*, x={c}): pass

@(lambda f, x={c}: f)
def f(): pass

def f(): {c}
a = 11
f()

def f(): {c}
f()
a = 11

lambda: {c}

f = lambda: {c}
a = 11
f()

g = ({c} for _ in 'ab')
a = 11
list(g)

[{c} for _ in 'ab']

{{{c} for _ in 'ab'}}

{{1: {c} for _ in 'ab'}}

[_ for _ in ({c}, 1)]

[1 for _ in 'ab' if {c}]

[{c} for a in (1, 2)]

[{c} for _ in 'a' for a in (1, 2)]

list({c} for a in (1, 2))

f'{{{c}}}'

print(f'{{a:{{{c}}}}}')

for d[{c}] in (1, 2): pass

for a, d[{c}] in ((1, 2), (3, 4)): pass

for _ in ({c},): pass

for a in (1, 2): {c}

for _ in (1, 2): {c}; a = 11

while next(turns): {c}

while next(turns) and not {c}: a = 11

for _ in 'ab': pass
else: {c}

with closing as d[{c}]: pass

with closing as a, wrap({c}): pass

with wrap({c}) as a: {c}

with closing:
  a = 11
  {c}
{c}

try: 1 / 0
except ({c}, ZeroDivisionError)[1]: pass

try:
  a = 11
  1 / 0
except ({c}, ZeroDivisionError)[1]: {c}

try: a = 11
finally: {c}

try: 1 / 0
except ZeroDivisionError as a: {c}

try: {c}
except KeyError: pass
else: a = 11
{c}

if {c}: a = 11
{c}

if flag: a = 11
{c}

if flag: {c}
elif {c}: a = 11
else: {c}

{c} if flag else {c}

flag and {c}

match 3:
  case a if {c}: {c}

match 3:
  case 3 if {c}: a = 11
{c}

match {c}:
  case _: {c}

assert not {c}, {c}

class K:
  a = 0
  {c}

class K:
  {c}
  a = 0

class K:
  a = 0
  v = [{c} for _ in 'ab']

class K({c} or object): pass

class K:
  a = 0
  class L:
    {c}

class K:
  a = 0
  def f(self): {c}
K().f()

class K:
  z = 10
  def f(self): pyautogui.click(z, 7)
K().f()

class K:
  a = 0
  f = lambda self: {c}
K().f()

class K:
  a = 0
  def f(self, x={c}): pass

class K:
  a = 0
  v = {{{c} for _ in 'ab'}}

class K(metaclass=wrap({c}, type)): pass

class M(type):
  __prepare__ = classmethod(lambda *_: {{'a': 50}})
class K(metaclass=M): {c}

class M(type):
  __prepare__ = classmethod(lambda *_: {{'a': 50}})
class B(metaclass=M): pass
class K(B): {c}

class K:
  a = 0
  class L({c} or object): pass

class K:
  a = 0
  v = list({c} for _ in 'ab')

class K:
  for a in (1, 2): {c}

def f():
  a = 1
  class K:
    {c}
    a = 2
f()

def f():
  a = 1
  def g(): {c}
  g()
f()

def f(a): {c}
f(3)

def f():
  {c}
  a = 11
f()

def f():
  a = 11
  {c}
f()
{c}

def f(a=3): {c}
f()

a = {c}
{c}

a += {c} or 1
{c}

d[{c}] = a = 11
{c}

a = d[{c}] = 11
{c}

del d[{c} or 0]

d[{c}]: int = 3

d[{c}] += 1

(a := 11, {c})

({c}, a := 11)

_K__a = 50; __a = 10
class K:
  pyautogui.click(__a, 7)

import pyautogui as __g
_K__g = mouse
class K:
  __g.click(10, 20)

async def f(): {c}
a = 11
try: f().send(None)
except StopIteration: pass

def f():
  yield {c}
f = f()
a = 11
list(f)

return_ = [{c}, a := 11, {c}]

def f():
  nonlocal_ = 1
  global a
  a = 11
  {c}
f()
{c}

global a
{c}

x = y = {c}, {c}
""")
CALLS = [
    "pyautogui.click(a, 7)",
    "pyautogui.moveTo(a, a + 1)",
    "click(10, 20)",
    "pyautogui.moveRel(*b)",
]


def test_no_place_of_a_call_is_overlooked():
    found = Counter()
    for place, call in itertools.product(PLACES, CALLS):
        code = "a, b = 10, (20, 30)\n" + place.format(c=call)
        verdict, reached = judge(code, HALF, around)
        assert verdict in ("refused", "right"), f"{code}\n{verdict}"
        found[verdict] += reached
    assert min(found["refused"], found["right"]) > 50


def around():
    """What the programs find around them."""
    closing = Closing()
    return {
        "closing": closing,
        "wrap": lambda _, value=closing: value,
        "flag": True,
        "turns": iter([True, True, False, False]),
        "d": {0: 0, None: 0},
    }


class Closing:
    """A context that yields 50 and swallows exceptions."""

    def __enter__(self):
        return 50

    def __exit__(self, *_):
        return True
