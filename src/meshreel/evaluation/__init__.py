"""The paper's evaluation: variants run, results stored, tables, figures and report built."""
