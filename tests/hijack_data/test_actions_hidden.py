"""Code that reaches the pointer in roundabout ways is refused or mapped: judged by running it."""

import itertools
from collections import Counter

import pytest

from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError

from support.pointer import judge, programs

HALF = CoordMap((540, 960), (1080, 1920))

# Expressions that are pyautogui, or some other library's pointer.
THINGS = programs(r"""
pyautogui

sys.modules['pyautogui']

globals()['pyautogui']

vars()['pyautogui']

locals()['pyautogui']

__import__('pyautogui')

getattr(sys, 'modules')['pyautogui']

sys.modules['__main__'].pyautogui

eval('pyautogui')

[pyautogui][0]

(lambda: pyautogui)()

(pyautogui if 1 else None)

(gui := pyautogui)

__builtins__['__import__']('pyautogui')

{'a': pyautogui}['a']

operator.attrgetter('pyautogui')(__main__)

__main__.pyautogui

page.mouse

page

mouse

win32api

autoit

uiautomation

(lambda m: m)(mouse)

importlib.import_module('pyautogui')

inspect.sys.modules['pyautogui']

print.__self__.__import__('pyautogui')
""")

# Ways to call the function {f} of a {t}hing with the arguments {a}.
WAYS = programs(r"""
{t}.{f}({a})

getattr({t}, '{f}')({a})

{t}.{f}.__call__({a})

f = {t}.{f}; f({a})

[{t}.{f}][0]({a})

list(map({t}.{f}, [10], [20]))

functools.partial({t}.{f}, {a})()

operator.methodcaller('{f}', {a})({t})

exec("{t}.{f}({a})")

(lambda m: m.{f}({a}))({t})

g = {t}
g.{f}({a})

(lambda f: f({a}))({t}.{f})

def go(h): h({a})
go({t}.{f})

def go(m={t}): m.{f}({a})
go()

for m in [{t}]: m.{f}({a})

class K:
  m = {t}
K.m.{f}({a})

with contextlib.nullcontext({t}) as m: m.{f}({a})

import builtins
builtins.exec("{t}.{f}({a})")

run = exec
run("{t}.{f}({a})")

[exec][0]("{t}.{f}({a})")

list(map(exec, ["{t}.{f}({a})"]))

(lambda f: f("{t}.{f}({a})"))(exec)

h = {{'f': {t}.{f}}}
h['f']({a})

match {t}:
  case m: m.{f}({a})

m, n = {t}, 1
m.{f}({a})

setattr(page, 'f', {t}.{f}); {t}.{f}({a})
""")
DEEDS = ["click", "moveTo", "move", "dragTo", "mouse_click", "SetCursorPos"]


def test_no_spelling_of_a_pointer_call_gets_past_the_mapping():
    found = Counter()
    for thing, way, deed in itertools.product(THINGS, WAYS, DEEDS):
        code = way.format(t=thing, f=deed, a="10, 20")
        verdict, reached = judge(code, HALF)
        assert verdict in ("refused", "right"), f"{code}\n{verdict}"
        found[verdict, reached] += 1
    assert found["refused", True] > 2000  # the programs do reach the pointer
    assert found["right", True] >= 4  # and calls that are written plainly are mapped


HIDDEN = programs(r"""
import pyautogui as t; t.click(10, 20); import time as t

import time as t; import pyautogui as t; t.click(10, 20)

import time as pyautogui
pyautogui.click(10, 20)

from pyautogui import _mouseMoveDrag
_mouseMoveDrag('move', 10, 20)

from pyautogui import platformModule as p
p.moveTo(10, 20)

from pyautogui import _pyautogui_x11 as p
p._moveTo(10, 20)

import pyautogui._pyautogui_x11 as p
p._moveTo(10, 20)

import pyautogui._pyautogui_x11
pyautogui._pyautogui_x11._moveTo(10, 20)

from pyautogui._pyautogui_x11 import moveTo as m
m(10, 20)

class K:
  from pyautogui import click as c
K.c(10, 20)

class K:
  import pyautogui as g
K.g.click(10, 20)

class K:
  import pyautogui as g
K.g.run('g10,20 c')

from pyautogui import _runCommandList as run
run('g10,20 c')

list(map(getattr(page, 'click'), [10], [20]))

name = 'goto_' + 'place'
list(map(getattr(page, name), [10], [20]))

f = page.goto_place
f(10, 20)

def go(there): there((10, 20))
go(page.goto_place)

page.tap(10, 20)

page.scroll(3, 10, 20)

LEFT = 10
from pyautogui import *
click(LEFT, 20)

from mouse import move as m
m(10, 20)

from page import click_at as c
c(10, 20)

from page import move
list(map(move, [10], [20]))

from page import *
click(10, 20)

import ctypes
ctypes.windll.user32.SetCursorPos(10, 20)

ctypes.windll.user32.SetCursorPos(10, 20)

win32api.SetCursorPos((10, 20))

Quartz.CGWarpMouseCursorPosition((10, 20))

autoit.mouse_click('left', 10, 20)

from Quartz import CGEventCreateMouseEvent as e
e(None, 5, (10, 20), 0)

mouse.position = (10, 20)

page.click('canvas', position={'x': 10, 'y': 20})

page.go(x=10, y=20)

page.at(coords=(10, 20))

page.touchscreen.tap(10, 20)

page.mouse.anything(10, 20)

mouse.xdo('10', 20)

page.moveTo('10', '20')

pyautogui.getActiveWindow().moveTo(10, 20)

click.__call__(10, 20)

f = click
f(10, 20)

list(map(click, [10], [20]))

(click if 1 else print)(10, 20)

(lambda f=click: f(10, 20))()

class P:
  def click(self): pass
click(10, 20)

click(10, 20)
def click(a, b): pass

click(10, 20)
from pyautogui import moveRel as click

def go():
  click(10, 20)
def click(a, b): pass

import builtins
builtins.eval('click(10, 20)')

class K:
  eval = None
eval('click(10, 20)')

pyautogui.screenshot('a.png', (1, 2, 10, 10))

pyautogui.screenshot('a.png', region=(1, 2, 10, 10))

pyautogui.locateOnScreen('a.png', (1, 2, 10, 10))

pyautogui.screenshot(*('a.png', (1, 2, 10, 10)))

kw = {'region': (1, 2, 10, 10)}
pyautogui.screenshot(**kw)

kw = ['a', (1, 2, 3, 4)]
pyautogui.screenshot(*kw)

r = (1, 2, 3, 4)
pyautogui.locateOnScreen('a.png', r)

s = pyautogui.screenshot
s('a.png', (1, 2, 3, 4))

from pyautogui import screenshot as s
s('a.png', (1, 2, 3, 4))

pyautogui.getWindowsAt(10, 20)

pyautogui.screenshot().getpixel((10, 20))

pyautogui.screenshot().crop((1, 2, 10, 20))

pyautogui.pyscreeze.pixel(10, 20)

pyautogui.clickAt(10, 20)

computer.quadruple_click(x=10, y=20)

subprocess.run(['xdotool', 'mousemove', '10', '20'])

subprocess.run('xdotool mousemove 10 20', shell=True)

c = f'xdotool mousemove {10} {20}'
subprocess.run(c)

subprocess.run(b'ydotool mousemove 10 20'.decode())

subprocess.run([sys.executable, '-c', 'import pyautogui; pyautogui.click(10, 20)'])

pyautogui.write(t := 'xdotool mousemove 10 20')
subprocess.run(t)

pyautogui.size = lambda: (960, 540)
w, h = pyautogui.size()
pyautogui.click(w, h)

pyautogui.click = page.mouse.go
pyautogui.click(10, 20)

print(f'{click(10, 20)}')
""")


@pytest.mark.parametrize("code", HIDDEN)
def test_hidden_ways_to_the_pointer_are_refused(code):
    with pytest.raises(ActionError, match=r"^line \d+, column \d+: .+; .+"):
        HALF.code_to_screen(code)
