"""The paper's figures and claims again, with several seeds, and with ranges or intervals."""
