"""The command `rodcone new` and the three below it."""

from cyclopts import App

from studies.commands.new.cluster import cluster
from studies.commands.new.preset import preset
from studies.commands.new.study import study

app = App(help_format="markdown", name="new", help="Write files to start from.")
app.command(preset)
app.command(study)
app.command(cluster)
