"""Scores: the figures of merit that data sheets and test houses state, in closed form beside simulated frames."""
