"""A recording made on the spot: a clothed mannequin, unlike the fitting model, filmed by four
cameras in a small room.
"""
