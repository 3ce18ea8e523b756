"""Training of the prior over patches that `isp.ple` develops with: pictures, and the mixture that fits them."""
