"""Disturbances of a real bench on the independent plants: is the observer right, or does it refuse truly?"""
