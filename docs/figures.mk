# The documentation's figures, made by rodcone itself: `make docs` runs this, and so does tests/test_docs_site.py.
# A figure is made anew where the code, or the page that holds its commands, is newer.
# Pictures that a page shows are kept in docs/pictures, so that they show where the sources are hosted too.
# Variables: BIN, the folder of python and rodcone; FIGURES, where the figures go; PICTURES, where the kept ones go; the
# commands' options.

BIN ?= .venv/bin
FIGURES ?= out/figures
PICTURES ?= docs/pictures
DEMO ?=
PAPER ?=
CODE := $(shell find rodcone render scenes sensor isp studies -type f -not -path '*/__pycache__/*')
# Pages whose blocks run; each in a folder of its own, from which its pictures are taken.
PAGES := $(wildcard docs/tutorial/*.md docs/how_to/*.md docs/understand/*.md)
RAN := $(PAGES:docs/%.md=$(FIGURES)/%/ran)

.DELETE_ON_ERROR:
.PHONY: figures pages
figures: pages $(FIGURES)/demo/report.html $(FIGURES)/paper/paper.html
pages: $(RAN)

$(FIGURES)/demo/report.html: $(CODE)
	$(BIN)/rodcone demo $(DEMO) -o $(@D)

$(FIGURES)/paper/paper.html: $(CODE)
	$(BIN)/rodcone paper $(PAPER) -o $(@D)

$(RAN): $(FIGURES)/%/ran: docs/%.md docs/run_page.py $(CODE)
	rm -rf $(@D)
	$(BIN)/python docs/run_page.py $< $(@D)
	$(BIN)/python docs/pictures.py $< $(@D) $(PICTURES)/$(notdir $*)
	@touch $@
