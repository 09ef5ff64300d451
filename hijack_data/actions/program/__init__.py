"""Static analysis of an agent's Python code, which is never run.

`source` parses code and edits it in place. `names` finds the names that mean pyautogui, `flow`
walks the program in the order in which it runs, and `folding` computes the constants (`values`) at
each call; `sharing` proves that nothing changes a list in between. `signatures` and `arguments`
describe the calls, `pointing` finds their coordinates. `guard` refuses programs that could move the
pointer in any other way, with `foreign`, `commands`, `literals` and `vocabulary`.
"""
