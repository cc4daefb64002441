"""Universal Scene Description: ``.usd .usda .usdc .usdz``, read and written."""
