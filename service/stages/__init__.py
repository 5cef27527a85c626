"""The stages of a job: setup converted, part prepared, accesses planned, programs written and proved.

No HTTP and no job table is known here. The files of a job are made in ``service.delivery``.
"""
