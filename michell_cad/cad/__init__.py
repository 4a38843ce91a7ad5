"""The truss as CAD geometry: node spheres, fillets and tubes as one closed shell, its direct mesh, STEP and STL.

Arrays until the last step: only `kernel.py` imports the CAD kernel (OCP).
"""
