"""The names in a run's log: `online_env` writes it, `pipelines` reads it, and neither knows the other.

RUN/run.json                       what was run
RUN/records.jsonl                  one record a line, as the episodes ended
RUN/episodes/<id>/episode.json     the record, written last
                  steps.jsonl      line k: observation k, and the action that was taken on seeing it
                  frames/          the clean screens, and what the agent saw where that differs
"""

FORMAT, VERSION = "agenthijack-run", 1
RUN, RECORDS, EPISODES = "run.json", "records.jsonl", "episodes"
EPISODE, STEPS, FRAMES = "episode.json", "steps.jsonl", "frames"
REINIT = "REQUEST_REINIT"  # what an agent says to be helped: no action on the screen
