"""Material laws: second Piola-Kirchhoff stress and tangent, each with its source."""
