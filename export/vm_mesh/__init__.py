"""The program vm-mesh, which draws and measures meshes."""
