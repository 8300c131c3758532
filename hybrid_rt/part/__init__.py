"""Reports of parts: thickness, clearance, volume, draft, holes and fillets, each with what is proven of it."""
