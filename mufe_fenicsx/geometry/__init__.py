"""From images to grain meshes: files, threshold, labels, surfaces, tetrahedra, shapes."""
