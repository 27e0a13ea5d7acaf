"""Code of others in a process of its own: started, asked, limited, ended; what it sends is judged here.

The tool and a guardian share nothing but three descriptors. The guardian begets the worker, in which the code
runs, counts the processes that come of it, and ends them all when the worker dies or the tool does. What
leaves the worker are numbers and texts in frames, never a pickle; what it prints goes into a pipe of its own.
"""
