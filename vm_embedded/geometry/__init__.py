"""The paper's geometry: shapes, lenses, orientation and observation planes."""
