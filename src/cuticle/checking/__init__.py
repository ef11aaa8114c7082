"""Proof: does a sampler draw what its pdf claims, and its pdf what the function needs?"""
