"""Human bodies: shapes, clothing and hair, skinning, mass distribution and MuJoCo models."""
