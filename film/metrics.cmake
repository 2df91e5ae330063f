# The measures stand alone, so that hosts can link them without the renderer.
lumicut_library(lumicut_metrics
  SOURCES metrics.cpp metrics_flip.cpp
  LINK lumicut_core)
