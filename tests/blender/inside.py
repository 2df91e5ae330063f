"""Runs unittest files inside Blender: blender -b --factory-startup -P inside.py -- in_light_units [Class.test ...]"""
import os
import sys
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import addon_utils  # noqa: E402

addon_utils.enable("lumicut_blender")
names = sys.argv[sys.argv.index("--") + 1:]
suite = unittest.defaultTestLoader.loadTestsFromNames(names)
result = unittest.TextTestRunner(sys.stderr, verbosity=2).run(suite)
sys.stderr.flush()
sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
