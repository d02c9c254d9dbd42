"""A run while it goes on: a page on this machine's own address that shows it, and stops or keeps it on request.

with LivePage(scenario, "runs/set_iib") as page:
    print(page.address)
    outcome = run_scenario(scenario, "runs/set_iib", make_simulation=Simulation, **page.watching(show, stop))
    page.end(outcome.finished)
"""

from warp_mpm.live.page import LivePage as LivePage
