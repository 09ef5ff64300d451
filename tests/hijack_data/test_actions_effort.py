"""The effort of a mapping grows with the length of the code: steps are counted, not seconds."""

import sys

import pytest

from hijack_data.coords import CoordMap

from support.pointer import programs

HALF = CoordMap((540, 960), (1080, 1920))

# A piece of code, of which a program holds many; {i} is its number.
PIECES = programs("""
if c:
    x{i} = {i}
    pyautogui.click(x{i}, 2)

if c:
    x = {i}
else:
    y{i} = {i}

x{i} = {i}
def f{i}():
    pyautogui.click(x{i}, 2)

x{i} = {i}
[pyautogui.click(x{i}, 2) for _ in c]

x{i} = {i}
g = (pyautogui.click(x{i}, 2) for _ in c)

p{i} = [{i}, 3]
pyautogui.click(*p{i})
print(p{i}[0])

for y{i} in c:
    x{i} = {i}
    pyautogui.click(3, 2)

while c:
    x{i} = {i}

try:
    x{i} = {i}
except E as e{i}:
    pyautogui.click(3, 2)

with c as y{i}:
    x{i} = {i}
    pyautogui.click(x{i}, 2)

class K{i}:
    x{i} = {i}
    pyautogui.click(x{i}, 2)

match c:
    case y{i}:
        x{i} = {i}

print('é'); pyautogui.click({i}, 2)

page{i}.go('text'); print(f'{x}')
""")


def steps(code):
    """How many functions Python calls, its own and built-in ones, to map `code`."""
    count = 0

    def note(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        HALF.code_to_screen(code)
    finally:
        sys.setprofile(before)
    return count


def program(piece, number):
    return "\n".join(piece.replace("{i}", str(i)) for i in range(number))


@pytest.mark.parametrize("piece", PIECES)
def test_four_times_the_code_takes_little_more_than_four_times_the_steps(piece):
    ratio = steps(program(piece, 120)) / steps(program(piece, 30))
    assert 3 < ratio < 5


def test_a_match_of_many_cases_takes_no_more():
    case = "    case {i}:\n        x{i} = {i}\n        pyautogui.click(x{i}, 2)"
    small, large = (f"match c:\n{program(case, number)}" for number in (30, 120))
    assert 3 < steps(large) / steps(small) < 5
